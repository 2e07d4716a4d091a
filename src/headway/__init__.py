"""What happens to a disturbance as it travels down a platoon of vehicles?"""

__version__ = "0.1.0"
