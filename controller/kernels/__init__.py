"""The compiled code: closed forms, interior point and the step of the loop; and how functions are compiled and kept."""
