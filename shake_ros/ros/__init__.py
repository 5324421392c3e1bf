"""The nodes: the only folder that imports rclpy or message packages."""
