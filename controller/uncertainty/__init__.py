"""What the controller does not know, and the wrench that holds all the same."""
