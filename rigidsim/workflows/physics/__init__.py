"""What a scene requires: what each effect is worth over its span, and the least model within an error."""
