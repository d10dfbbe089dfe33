"""What a person writes: a scene of particles, links, riders, contact generators and forces."""
