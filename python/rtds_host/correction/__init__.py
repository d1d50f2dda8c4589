"""A diagnosis put into the real-time simulator: motor units, robot and sensors."""
