using System.ComponentModel;

namespace Nep
{
    // Names in listings 9 and 10 of the paper and in the samples of that time.
    public sealed partial class Node
    {
        /// <summary>Name of the original library for <see cref="CreatePublisher"/>.</summary>
        [EditorBrowsable(EditorBrowsableState.Never)]
        public Publisher new_pub(string topic, string msg_type = "json")
        {
            return CreatePublisher(topic, msg_type);
        }

        /// <summary>Name of the original library for <see cref="CreateSubscriber"/>.</summary>
        [EditorBrowsable(EditorBrowsableState.Never)]
        public Subscriber new_sub(string topic, string msg_type = "json")
        {
            return CreateSubscriber(topic, msg_type);
        }

        /// <summary>Name of the original library for <see cref="Close()"/>.</summary>
        [EditorBrowsable(EditorBrowsableState.Never)]
        public void close()
        {
            Close();
        }
    }

    public sealed partial class Publisher
    {
        /// <summary>Name of the original library for <see cref="Publish"/>.</summary>
        [EditorBrowsable(EditorBrowsableState.Never)]
        public void publish(object message)
        {
            Publish(message);
        }

        /// <summary>Name of the original library for <see cref="Close"/>.</summary>
        [EditorBrowsable(EditorBrowsableState.Never)]
        public void close()
        {
            Close();
        }
    }

    public sealed partial class Subscriber
    {
        /// <summary>Wait for the next message and return its JSON or text; empty if the subscriber was closed.</summary>
        [EditorBrowsable(EditorBrowsableState.Never)]
        public string listen()
        {
            Message message = Receive();
            return message == null ? "" : message.Text;
        }

        /// <summary>Take the JSON or text of the next message without waiting; false if there is none, with <paramref name="msg"/> unchanged.</summary>
        [EditorBrowsable(EditorBrowsableState.Never)]
        public bool listenNB(ref string msg)
        {
            Message message = _socket.Inbox.Take(0);
            if (message == null)
            {
                return false;
            }
            msg = message.Text;
            return true;
        }

        /// <summary>Name of the original library for <see cref="Close"/>.</summary>
        [EditorBrowsable(EditorBrowsableState.Never)]
        public void close()
        {
            Close();
        }
    }
}
