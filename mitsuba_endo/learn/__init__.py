"""Training of the decoder; the only room that knows PyTorch."""
