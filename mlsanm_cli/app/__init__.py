"""The commands: build a scene from a case, solve it, write and show the results."""
