"""What an object's measured motion tells of its mass, its centre of mass, its inertia and its friction."""
