using System.ComponentModel;

namespace Nep
{
    /// <summary>Geometry messages with the names of the original library 0.0.0.5 and the fields of ROS 1.</summary>
    [EditorBrowsable(EditorBrowsableState.Never)]
    public static class NepGeometryMsgs
    {
        /// <summary>Same as <c>geometry_msgs/Vector3</c>.</summary>
        public sealed class NepVector3
        {
            public double x;
            public double y;
            public double z;
        }

        /// <summary>Same as <c>geometry_msgs/Point</c>.</summary>
        public sealed class NepPoint
        {
            public double x;
            public double y;
            public double z;
        }

        /// <summary>Same as <c>geometry_msgs/Point32</c>.</summary>
        public sealed class NepPoint32
        {
            public float x;
            public float y;
            public float z;
        }

        /// <summary>Same as <c>geometry_msgs/Quaternion</c>.</summary>
        public sealed class NepQuaternion
        {
            public double x;
            public double y;
            public double z;
            public double w;
        }

        /// <summary>Same as <c>geometry_msgs/Pose</c>.</summary>
        public sealed class NepPose
        {
            public NepPoint position = new NepPoint();
            public NepQuaternion orientation = new NepQuaternion();
        }

        /// <summary>Same as <c>geometry_msgs/Pose2D</c>.</summary>
        public sealed class NepPose2D
        {
            public double x;
            public double y;
            public double theta;
        }

        /// <summary>Same as <c>geometry_msgs/Twist</c>.</summary>
        public sealed class NepTwist
        {
            public NepVector3 linear = new NepVector3();
            public NepVector3 angular = new NepVector3();
        }

        /// <summary>Same as <c>geometry_msgs/Accel</c>.</summary>
        public sealed class NepAccel
        {
            public NepVector3 linear = new NepVector3();
            public NepVector3 angular = new NepVector3();
        }

        /// <summary>Same as <c>geometry_msgs/Wrench</c>.</summary>
        public sealed class NepWrench
        {
            public NepVector3 force = new NepVector3();
            public NepVector3 torque = new NepVector3();
        }

        /// <summary>Same as <c>geometry_msgs/Transform</c>.</summary>
        public sealed class NepTransform
        {
            public NepVector3 translation = new NepVector3();
            public NepQuaternion rotation = new NepQuaternion();
        }
    }
}
