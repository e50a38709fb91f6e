"""How networks are trained: sets, recipes, one loop and the networks; needs PyTorch."""
