"""The rigid body of a scene: from ``[body]`` to mass, principal moments and principal axes."""
