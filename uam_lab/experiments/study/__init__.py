"""A study of `uam compare --study`: laws of equal feedback and margin over varied flights."""
