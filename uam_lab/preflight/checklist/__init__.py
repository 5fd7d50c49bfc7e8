"""The checklist before a flight of a real vehicle; see docs/preflight.md. No middleware."""
