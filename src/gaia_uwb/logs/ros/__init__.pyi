from .log import RosLog as RosLog
