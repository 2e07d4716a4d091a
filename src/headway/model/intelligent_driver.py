from headway.models.intelligent_driver import *  # temporary
