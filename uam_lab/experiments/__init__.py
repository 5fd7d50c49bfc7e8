"""Many flights: campaigns, comparisons, studies, searches, margins, budgets."""
