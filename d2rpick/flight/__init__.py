"""When do the parts fly?  The window between the end of the load and the next contact."""
