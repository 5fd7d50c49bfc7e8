"""A study: laws of equal feedback and margin over varied flights."""
