"""The survey of robots that exist."""
