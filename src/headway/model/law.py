from headway.models.law import *  # temporary
