"""What a run is worth: its measures, the slip that the simulator itself makes, the verdict and its reasons."""
