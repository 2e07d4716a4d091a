from headway.models.maths import *  # temporary
