"""What a flight looked like: figures, pictures, video, one offline page."""
