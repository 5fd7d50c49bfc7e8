"""One flight: its settings, its two engines, its progress and conclusion."""
