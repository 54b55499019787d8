"""Where an object may be pivoted: the contacts that can stay put, and how far it tilts about them."""
