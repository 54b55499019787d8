"""What is compiled: the closed forms, the interior point, and how functions are compiled and kept."""
