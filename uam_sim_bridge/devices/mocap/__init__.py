"""Motion capture: frames of the tracking system → poses of the vehicle, ENU and FLU."""
