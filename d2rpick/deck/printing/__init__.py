"""A switch window as solver input."""
