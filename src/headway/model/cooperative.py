from headway.models.cooperative import *  # temporary
