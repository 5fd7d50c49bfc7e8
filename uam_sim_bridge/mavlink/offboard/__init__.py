"""From tau_p, tau_q to a setpoint; OFFBOARD, arming, level hold."""
