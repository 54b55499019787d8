"""What a run is made of: the keys, the scenarios that use them, and those that are shipped."""
