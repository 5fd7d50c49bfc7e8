"""tau_p and tau_q → setpoint; OFFBOARD, arming, level hold."""
