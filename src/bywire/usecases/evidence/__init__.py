"""Kinds of evidence for a sign-off. Only a sign-off loads these modules."""
