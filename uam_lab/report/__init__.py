"""Report of a flight: figures, pictures, video and one offline page."""
