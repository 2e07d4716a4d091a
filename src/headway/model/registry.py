from headway.models.registry import *  # temporary
