"""What a sensor saw: scans, odometry at their stamps, rays through a world."""
