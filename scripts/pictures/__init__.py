"""The pictures of demonstrations in the READMEs."""
