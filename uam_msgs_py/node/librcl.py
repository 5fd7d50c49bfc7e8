"""ROS's C libraries, for the functions that rclpy leaves out; rclpy has loaded them before."""

import ctypes

rcl, rcutils = ctypes.CDLL("librcl.so"), ctypes.CDLL("librcutils.so")
OK = 0  # RCL_RET_OK and RMW_RET_OK
