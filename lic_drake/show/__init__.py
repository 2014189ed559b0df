"""Pictures of reaches: recordings (Meshcat), stills (rendered), figures (matplotlib) and films."""
