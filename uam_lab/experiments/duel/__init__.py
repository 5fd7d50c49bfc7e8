"""`uam duel`: laws over the tasks of another laboratory, beside its published figures."""
