"""Estimation of chi, chi_dot, chi_ddot from motion capture, IMU and joint encoders."""

from uam_control.estimation.estimator import EstimatorParameters, StateEstimator
