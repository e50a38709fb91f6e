"""Read ROS logs without ROS: bags, MCAP, and ROS 2's folders and databases."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
