"""What is measured of worlds: energy and how well links hold; health lies with the state."""
