from .reader import DEVICES as DEVICES, read_serial as read_serial
