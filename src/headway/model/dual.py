from headway.models.dual import *  # temporary
