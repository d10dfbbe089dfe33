"""Questions to a world that change nothing: what a ray or a moving shape would hit, what lies within a shape."""
