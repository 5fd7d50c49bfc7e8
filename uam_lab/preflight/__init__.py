"""Before a flight: installation and devices (doctor), the checklist of a vehicle."""
