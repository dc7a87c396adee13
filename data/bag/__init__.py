"""ROS bags: those of ROS 1 (`.bag`) and rosbag2's databases (`.db3`), read through the extra `bags`."""
