"""ROS 2 without a ROS installation: topics over Zenoh, as rmw_zenoh names them."""
