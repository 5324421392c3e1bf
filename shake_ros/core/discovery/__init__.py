"""The missing effect: residual → screening → refit → choice → what remains."""
