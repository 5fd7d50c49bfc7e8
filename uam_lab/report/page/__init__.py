"""The report page, the overlay page and the table on the console."""
