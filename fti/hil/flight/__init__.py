"""What is flown: trajectories with everything that sensors can measure of them."""
