"""What the commands do: build a scene from a case, solve it, write it, show it."""
