"""What people look at: recordings and figures."""
