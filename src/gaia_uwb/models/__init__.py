"""What a trained model is, what it sees of an episode, and its files, without PyTorch."""
