from headway.models.general_motors import *  # temporary
