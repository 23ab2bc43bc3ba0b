"""Files that the application writes beside a campaign: manifest, devices, delay of motion capture, answers as JSON."""
