"""The closed loop live, on a page in the browser."""
