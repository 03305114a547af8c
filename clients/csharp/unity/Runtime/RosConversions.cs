using UnityEngine;

namespace Nep.Unity
{
    /// <summary>Coordinates between ROS (x forward, y left, z up) and Unity (x right, y up, z forward), in metres.</summary>
    public static class RosConversions
    {
        /// <summary>Convert a position, direction or velocity from ROS to Unity.</summary>
        /// <param name="x">Forward.</param>
        /// <param name="y">Left.</param>
        /// <param name="z">Up.</param>
        public static Vector3 ToUnity(double x, double y, double z)
        {
            double right, up, forward;
            FrameConversion.RosToUnity(x, y, z, out right, out up, out forward);
            return new Vector3((float)right, (float)up, (float)forward);
        }

        /// <summary>Convert a rotation from ROS to Unity.</summary>
        /// <param name="x">Vector part, forward.</param>
        /// <param name="y">Vector part, left.</param>
        /// <param name="z">Vector part, up.</param>
        /// <param name="w">Scalar part.</param>
        public static Quaternion ToUnity(double x, double y, double z, double w)
        {
            double right, up, forward;
            FrameConversion.RosToUnityRotation(x, y, z, out right, out up, out forward);
            return new Quaternion((float)right, (float)up, (float)forward, (float)w);
        }

        /// <summary>Convert a position, direction or velocity from Unity to ROS, as x, y and z.</summary>
        /// <param name="vector">Vector in Unity's coordinates.</param>
        public static Vector3 ToRos(Vector3 vector)
        {
            double x, y, z;
            FrameConversion.UnityToRos(vector.x, vector.y, vector.z, out x, out y, out z);
            return new Vector3((float)x, (float)y, (float)z);
        }

        /// <summary>Convert a rotation from Unity to ROS, as x, y, z and w.</summary>
        /// <param name="rotation">Rotation in Unity's coordinates.</param>
        public static Quaternion ToRos(Quaternion rotation)
        {
            double x, y, z;
            FrameConversion.UnityToRosRotation(rotation.x, rotation.y, rotation.z, out x, out y, out z);
            return new Quaternion((float)x, (float)y, (float)z, rotation.w);
        }
    }
}
