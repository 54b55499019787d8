"""One step of the closed loop: sense, observe, control, actuate, plant; and the log of each."""
