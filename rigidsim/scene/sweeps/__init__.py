"""Members of a ``[sweep]``, each with exact values."""
