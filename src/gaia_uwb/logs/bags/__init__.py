"""Walk the containers of ROS messages record by record: ROS 1 bags, MCAP and SQLite."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
