"""Robot ends: what has wheels and sensors, or plays back what they once said."""
